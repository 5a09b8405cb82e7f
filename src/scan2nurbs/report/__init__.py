"""Reports: JSON first; HTML and pictures made from it."""
