"""What runs while a plant runs: parts that each hold their own state; app/runtime.py builds and connects them."""
