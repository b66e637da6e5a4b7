"""The problem made linear: what each set of explanations has for it, under noise."""
