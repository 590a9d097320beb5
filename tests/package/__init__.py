"""The installed package: public names, wheels, and a project that uses them."""
