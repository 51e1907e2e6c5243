"""Drawings that can be made anew at every move of a control: SVG markup from plain functions, in milliseconds.

Text and lines take the colour of the page they stand on, so that a drawing fits a light page and a dark one; cells keep
the colours of :mod:`sec_lab.viz.style` and have their codes printed in them.
"""
