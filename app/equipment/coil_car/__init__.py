"""A coil car under a recoiler: it takes coils from the mandrel and lays them onto saddles."""
