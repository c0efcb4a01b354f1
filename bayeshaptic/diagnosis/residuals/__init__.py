"""Tests of what a fit leaves over."""
