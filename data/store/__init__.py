"""What lies on disk: scene and bake folders, bare graphs, claims, certificates, compiled maps. Parquet and JSON."""
