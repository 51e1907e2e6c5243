"""Tabletop actions: rendered stereo movies of the four action types of §2.3, with their truth.

``python -m sec_lab.worlds.tabletop FOLDER`` makes them. A movie is planned (objects, hands and their paths), rendered
(colour for both eyes; labels and depth for the left one) and written beside what is true in it.
"""
