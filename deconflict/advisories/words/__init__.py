"""What advisories and situations say, in sentences for people, made of facts."""
