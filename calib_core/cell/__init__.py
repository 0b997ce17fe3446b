"""What a cell is made of: what carries scanner and ball, and the way between them."""
