"""The operator's panel: a machine in a browser. The desk serves it without a page; the page shows the desk."""
