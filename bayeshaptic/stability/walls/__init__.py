"""Walls with stiffness and damping: boundaries, regions, tables."""
