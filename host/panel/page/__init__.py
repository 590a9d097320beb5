"""The panel's page, made with NiceGUI: one view a file. Only this room imports nicegui."""
