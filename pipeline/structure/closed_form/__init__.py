"""What theory says without elements, to stand beside what they say."""
