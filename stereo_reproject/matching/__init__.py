"""Light that one engine has traced, made to agree with a picture that another has rendered."""
