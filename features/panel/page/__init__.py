"""The panel's page, made with NiceGUI: one view a file. Only this room and a stored run's page import nicegui."""
