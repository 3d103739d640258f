"""Materials: what surfaces do with light. `materials.base` states what each one promises."""
