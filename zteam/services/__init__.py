"""Requests and replies of the processes' queries, and the clients that ask."""
