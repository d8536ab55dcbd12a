"""The inner loops, in C. `build.py` compiles them when zteam is installed; `binding.py` is how Python reaches them."""
