"""Colours, HTML and the frame of a figure: what the lab page and the live view are drawn with.

Text and curves come in, elements of NiceGUI and figures of Plotly go out. Nothing here knows the lab or a flight.
"""
