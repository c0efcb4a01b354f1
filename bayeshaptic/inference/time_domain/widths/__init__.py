"""How far the values of a fitted motion may be off: by noise, between pieces, and by friction."""
