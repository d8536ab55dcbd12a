"""A view of the team in a browser: what the page asks for, and what it gets (docs/view.md)."""
