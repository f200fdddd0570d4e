"""The borders of known floor: where they are, what is seen from them, what lies behind, and how to choose."""
