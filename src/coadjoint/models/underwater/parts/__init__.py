"""Parts of underwater vehicles: each pushes, may be commanded, and is a line of the energy budget."""
