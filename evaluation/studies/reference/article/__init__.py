"""The article on the reference results: question, method, results, limits."""
