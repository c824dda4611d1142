"""How soon a reading is on its way to the phone, with studies that are run live, and whether that lasts."""
