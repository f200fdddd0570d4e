"""The borders of known floor: where they are, what is seen from them, what lies behind, and the decision among them."""
