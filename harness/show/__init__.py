"""What people look at: pages, figures and tables. Nothing that computes results imports this room."""
