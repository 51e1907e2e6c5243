"""Shapes as glTF files, the one format whose textures and roughness the renderer takes over."""

from pathlib import Path

import numpy as np
from PIL import Image

from sec_lab.worlds.tabletop.shapes import Shape, vertex_normals


def write_gltf(folder: Path, name: str, shape: Shape) -> Path:
    """Write a shape as ``name.gltf`` with its buffers beside it.

    Parameters
    ----------
    folder : Path
        Must exist.
    name : str
        Has to be unique in the folder.
    shape : Shape

    Returns
    -------
    Path
        Of the glTF file.
    """
    import trimesh
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    # glTF has y upwards.
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    material = PBRMaterial(
        baseColorTexture=Image.fromarray(shape.texture), metallicFactor=0.0, roughnessFactor=shape.roughness
    )
    mesh = trimesh.Trimesh(
        vertices=shape.vertices_m @ upright.T,
        faces=shape.faces,
        vertex_normals=vertex_normals(shape) @ upright.T,
        visual=TextureVisuals(uv=shape.uv, material=material),
        process=False,
    )
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(mesh), include_normals=True)
    # The buffers of all shapes share the folder.
    text = files.pop("model.gltf").decode()
    for buffer, content in files.items():
        text = text.replace(buffer, f"{name}_{buffer}")
        (folder / f"{name}_{buffer}").write_bytes(content)
    path = folder / f"{name}.gltf"
    path.write_text(text, encoding="utf-8")
    return path
