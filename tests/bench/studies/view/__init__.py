"""The view under load: pages without a browser, and a browser that draws (docs/view.md)."""
