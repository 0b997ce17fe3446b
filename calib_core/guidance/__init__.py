"""What to do next and what it is worth at the part: the covariance that poses will give, before they are taken."""
