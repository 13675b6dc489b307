"""One self-contained page about one or several data sets, as HTML and as PDF."""
