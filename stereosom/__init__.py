"""Two views of a thin flexible device in, its 3D backbone out."""
