"""The report page."""

PAGE = "index.html"
