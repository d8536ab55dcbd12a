"""What tests share: doubles, harnesses and scenes."""
