"""What is asked of the user and told in words and charts. A panel owns its widgets and shows a session in them."""
