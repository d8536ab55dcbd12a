"""What the study `robots` runs: chains of robots on tours, and what their true poses say of them."""
