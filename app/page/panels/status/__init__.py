"""Status panels: always visible, outside the tabs, or by keyboard."""
