"""Diaz and Gil (2010) reproduced: one module a part of the paper, run by `reproduce_paper.py`."""
