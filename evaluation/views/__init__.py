"""What people look at: plots, films, the page of results, matrices of scores."""
