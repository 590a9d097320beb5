"""The panel's page, made with NiceGUI: one view a file. Nobody else imports nicegui but a stored run's page."""
