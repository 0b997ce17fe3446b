"""What files as they lie are: each by its content, measurements paired with poses, a session made of them."""
