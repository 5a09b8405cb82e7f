"""Reading and writing of points, one file a format."""
