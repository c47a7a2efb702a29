"""The parts of the page: each is a function that draws what the workbench knows, with the elements of NiceGUI."""
