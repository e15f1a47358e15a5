"""Page kit: colours, HTML, charts and widgets that layers and panels share."""
