// How faces look: shaded flat; and, if asked for, which of them face away from a view cell, so that no eye in it sees them.

import { DoubleSide, MeshLambertMaterial, Vector3 } from "three";

// Compiled only where it is asked for: a processor that draws takes a quarter longer with it.
const BACKS = `
  #ifdef BACKS
    vec3 outwards = normalize(cross(dFdx(vPlace), dFdy(vPlace))) * (gl_FrontFacing ? 1.0 : -1.0);
    // Of all eyes in a box the one that lies farthest along the normal decides.
    bool away = dot(outwards, backsMiddle - vPlace) + dot(abs(outwards), backsHalf) < 0.0;
    if (away) diffuseColor.rgb = vec3(0.6, 0.19, 0.38);
  #endif
`;
// Differences of neighbouring pixels, by which faces are shaded, can vanish on a very large one: such are grounds.
const LEVEL = "if (!(dot(normal, normal) > 0.5)) normal = (viewMatrix * vec4(0.0, 0.0, 1.0, 0.0)).xyz;";

/** Eyes that see backs of faces: in no cell at first. */
export class Backs {
  constructor() {
    this.uniforms = { backsMiddle: { value: new Vector3() }, backsHalf: { value: new Vector3() } };
    this.materials = [];
  }

  /** Colour what faces away from all of a box, 6 numbers; nothing for null. */
  of(box) {
    for (const material of this.materials) {
      if (!!material.defines.BACKS === !!box) continue;
      if (box) material.defines.BACKS = 1;
      else delete material.defines.BACKS;
      material.needsUpdate = true;
    }
    if (!box) return;
    this.uniforms.backsMiddle.value.set(...[0, 1, 2].map((k) => (box[k] + box[k + 3]) / 2));
    this.uniforms.backsHalf.value.set(...[0, 1, 2].map((k) => (box[k + 3] - box[k]) / 2));
  }
}

/** The material of faces, glass or not; `planes` cut them. */
export function faceMaterial(clear, planes, backs) {
  const material = new MeshLambertMaterial({
    side: DoubleSide, flatShading: true, clippingPlanes: planes,
    // Edges lie on faces.
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    ...(clear ? { transparent: true, opacity: 0.35, depthWrite: false } : {}),
  });
  material.defines = {};
  backs.materials.push(material);
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, backs.uniforms);
    shader.vertexShader = `#ifdef BACKS\nvarying vec3 vPlace;\n#endif\n${shader.vertexShader}`
      .replace("#include <project_vertex>", "#include <project_vertex>\n#ifdef BACKS\nvPlace = (modelMatrix * batchingMatrix * vec4(transformed, 1.0)).xyz;\n#endif");
    shader.fragmentShader = `#ifdef BACKS\nvarying vec3 vPlace;\nuniform vec3 backsMiddle, backsHalf;\n#endif\n${shader.fragmentShader}`
      .replace("#include <color_fragment>", `#include <color_fragment>\n${BACKS}`)
      .replace("#include <normal_fragment_begin>", `#include <normal_fragment_begin>\n${LEVEL}`);
  };
  return material;
}
