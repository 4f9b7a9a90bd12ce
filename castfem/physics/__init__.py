"""Physics: materials, constitutive laws, heat, mechanics, contact, machine and mould."""
