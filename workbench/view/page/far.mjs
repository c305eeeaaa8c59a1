// Textured depth meshes in the picture: the image that the middle of a view cell sees is thrown onto them, and a mesh shows
// the texels of its layer alone.

import {
  BufferAttribute, BufferGeometry, DataTexture, DoubleSide, Group, Matrix3, Mesh, ShaderMaterial, Vector3,
} from "three";

import { FACES, decodeFace, placed } from "./depth.mjs";
import { loadScript } from "./reasons.mjs";
import { decode } from "./runs.mjs";

// View cells whose meshes are kept.
const KEPT = 4;
const NOTHING = 255;

const VERTEX = `
attribute float layer;
uniform mat3 axes;
uniform vec3 middle;
varying vec3 seen;
varying vec3 world;
varying float own;
void main() {
  seen = axes * (position - middle);
  world = position;
  own = layer;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

// Light as of the stage, a sky and a sun; but mostly even, as triangles of a mesh are turned less exactly than they lie.
const FRAGMENT = `
uniform sampler2D image;
uniform vec3 sun;
varying vec3 seen;
varying vec3 world;
varying float own;
void main() {
  int texels = textureSize(image, 0).x;
  float middle = 0.5 * float(texels);
  vec2 spot = seen.xy / seen.z * (middle - 1.0);
  ivec2 texel = ivec2(floor(middle + spot.x), floor(middle - spot.y));
  vec4 shown = texelFetch(image, clamp(texel, ivec2(0), ivec2(texels - 1)), 0);
  if (abs(255.0 * shown.a - own) > 0.5) discard;
  vec3 normal = normalize(cross(dFdx(world), dFdy(world)));
  if (dot(normal, cameraPosition - world) < 0.0) normal = -normal;
  vec3 sky = 2.1 * mix(vec3(0.456, 0.434, 0.392), vec3(1.0), 0.5 * normal.z + 0.5);
  vec3 light = mix(vec3(1.75, 1.73, 1.7), sky + 1.1 * max(dot(normal, sun), 0.0), 0.6);
  vec3 linear = mix(shown.rgb / 12.92, pow((shown.rgb + 0.055) / 1.055, vec3(2.4)), step(0.04045, shown.rgb));
  gl_FragColor = vec4(linear * light * 0.31831, 1.0);
  #include <colorspace_fragment>
}`;

/** Pixels of a PNG, red, green, blue, alpha, exactly as they are stored. */
async function pixelsOf(png) {
  const picture = await createImageBitmap(new Blob([png], { type: "image/png" }), { premultiplyAlpha: "none", colorSpaceConversion: "none" });
  const canvas = new OffscreenCanvas(picture.width, picture.height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(picture, 0, 0);
  return context.getImageData(0, 0, picture.width, picture.height).data;
}

export class Far {
  /** None yet; `colours` of objects by id, three numbers from 0 to 1, `arrived` hears of meshes that have come. */
  constructor(database, colours, arrived, failed) {
    Object.assign(this, { database, colours, arrived, failed });
    this.rows = new Map(Array.from(database.depthCells, (cell, row) => [cell, row]));
    this.held = new Map();
    this.group = new Group();
    globalThis.viewcellDepth = new Map();
  }

  /** Whether any view cell has meshes. */
  get any() {
    return this.rows.size > 0;
  }

  /** Objects that stand on the meshes of a row, ascending. */
  farOf(row) {
    const { depthFar, depthFarStarts, objects } = this.database;
    return decode(depthFar, depthFarStarts[row], depthFarStarts[row + 1], objects);
  }

  /** Draw the meshes of a cell, where it has some and they are here, and no others; the row, or -1. They are asked for. */
  show(cell) {
    const row = this.rows.get(cell) ?? -1;
    this.group.clear();
    if (row < 0) return -1;
    const { held } = this;
    if (!held.has(row)) {
      held.set(row, null);
      this.bring(row).then(this.arrived, (error) => {
        this.held.delete(row);
        this.failed(error);
      });
    }
    const meshes = held.get(row);
    // The one that was used last comes last.
    held.delete(row);
    held.set(row, meshes);
    if (!meshes) return -1;
    this.group.add(...meshes);
    return row;
  }

  /** Read and place the meshes of a row, and forget those that were not used for longest. */
  async bring(row) {
    await loadScript(`depth-${row}.js`);
    const faces = globalThis.viewcellDepth.get(row);
    globalThis.viewcellDepth.delete(row);
    const far = this.farOf(row);
    const meshes = await Promise.all(faces.map((text, face) => this.mesh(row, face, far, text)));
    this.held.set(row, meshes.filter(Boolean));
    for (const [old, own] of this.held) {
      if (this.held.size <= KEPT) break;
      if (old === row || !own) continue;
      for (const mesh of own) {
        mesh.geometry.dispose();
        mesh.material.uniforms.image.value.dispose();
        mesh.material.dispose();
      }
      this.held.delete(old);
    }
  }

  /** A face in the picture; null for one that shows nothing. */
  async mesh(row, face, far, text) {
    const { texels, png, meshes } = await decodeFace(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)));
    if (!meshes.length) return null;
    const middle = this.database.depthMiddles.subarray(3 * row, 3 * row + 3);
    const sizes = meshes.map((mesh) => mesh.places.length);
    const total = sizes.reduce((sum, size) => sum + size, 0);
    const [position, layer, index] = [new Float32Array(3 * total), new Float32Array(total), []];
    let begin = 0;
    meshes.forEach((mesh, number) => {
      const corners = placed(mesh, texels, this.database.depthReaches[row], FACES[face]);
      corners.forEach((x, k) => (position[3 * begin + k] = x + middle[k % 3]));
      layer.fill(number, begin, begin + sizes[number]);
      for (const corner of mesh.triangles) index.push(begin + corner);
      begin += sizes[number];
    });
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(position, 3));
    geometry.setAttribute("layer", new BufferAttribute(layer, 1));
    geometry.setIndex(index);
    const image = new DataTexture(this.image(await pixelsOf(png), far), texels, texels);
    image.needsUpdate = true;
    const material = new ShaderMaterial({
      vertexShader: VERTEX, fragmentShader: FRAGMENT, side: DoubleSide,
      uniforms: {
        image: { value: image }, middle: { value: new Vector3(...middle) }, axes: { value: new Matrix3().set(...FACES[face].flat()) },
        sun: { value: new Vector3(0.5, -0.7, 1.2).normalize() },
      },
    });
    const mesh = new Mesh(geometry, material);
    mesh.frustumCulled = false;
    return mesh;
  }

  /** Colours of texels, and their layers where pictures have how clear they are. */
  image(pixels, far) {
    const found = new Uint8Array(pixels.length);
    for (let at = 0; at < pixels.length; at += 4) {
      const rank = pixels[at] + 256 * pixels[at + 1] - 1;
      found[at + 3] = rank < 0 ? NOTHING : pixels[at + 2];
      if (rank >= 0) for (let k = 0; k < 3; k++) found[at + k] = Math.round(255 * this.colours[far[rank]][k]);
    }
    return found;
  }

  /** Triangles of what is drawn. */
  get triangles() {
    return this.group.children.reduce((sum, mesh) => sum + mesh.geometry.index.count / 3, 0);
  }
}
