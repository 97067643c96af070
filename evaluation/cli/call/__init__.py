"""What a call asks for, before anything is carried out."""
