"""Model readers: IFC and meshes."""
