"""How a picture is drawn: axes in three strokes, pixels and SVG at once."""
