"""Two folders of results side by side: what determines them, and what came out."""
