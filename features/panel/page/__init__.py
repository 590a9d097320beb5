"""The panel's page, made with NiceGUI: one view a file. Only this folder and the replay's page import nicegui."""
