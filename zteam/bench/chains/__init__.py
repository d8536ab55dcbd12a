"""What `zteam bench robots` runs: chains of robots on tours, and what their true poses say of them."""
