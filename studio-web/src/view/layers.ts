/** What is drawn besides the points: curves, fitted surfaces, control nets, the model; each can be switched and faded. */
import * as THREE from "three";
import type { Values } from "../frames";
import { head } from "./cloud";
import { FACES_FRAGMENT, FACES_VERTEX, PICK_FACES_FRAGMENT } from "./shaders";

export type Palette = { palette: { value: THREE.Texture | null }; paletteSize: { value: number } };

export class Lines {
  readonly object: THREE.LineSegments;

  /** Lines are drawn nearer to the eye by `lift`, so that noisy points beside them do not bury them. */
  constructor(segments: Values, colour: number, lift = 0) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(segments, 3));
    const material = new THREE.LineBasicMaterial({ color: colour, transparent: true });
    material.onBeforeCompile = (shader): void => {
      shader.uniforms["lift"] = { value: lift };
      shader.vertexShader = shader.vertexShader
        .replace("void main() {", "uniform float lift;\nvoid main() {")
        .replace("#include <project_vertex>", "vec4 mvPosition = modelViewMatrix * vec4(transformed, 1.0);\nmvPosition.z += lift;\ngl_Position = projectionMatrix * mvPosition;");
    };
    this.object = new THREE.LineSegments(geometry, material);
    this.object.renderOrder = 2;
    this.object.frustumCulled = false;
  }

  fade(opacity: number): void {
    (this.object.material as THREE.LineBasicMaterial).opacity = opacity;
  }

  dispose(): void {
    this.object.geometry.dispose();
  }
}

/** Control nets: dots at the control points, and lines that are fainter where something hides them, since nets lie on both sides. */
export class Nets extends Lines {
  private readonly hidden = new THREE.LineBasicMaterial({ transparent: true, depthTest: false });
  private readonly dots = new THREE.PointsMaterial({ transparent: true, depthTest: false, size: 5, sizeAttenuation: false });

  constructor(segments: Values, colour: number) {
    super(segments, colour);
    const { geometry } = this.object;
    for (const child of [new THREE.LineSegments(geometry, this.hidden), new THREE.Points(geometry, this.dots)]) {
      child.material.color.set(colour);
      child.renderOrder = 2;
      child.frustumCulled = false;
      this.object.add(child);
    }
  }

  override fade(opacity: number): void {
    super.fade(opacity);
    this.hidden.opacity = 0.7 * opacity;
    this.dots.opacity = opacity;
  }
}

export class FaceMesh {
  readonly object: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  readonly picked: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  private readonly opacity = { value: 1 };

  constructor(corners: Values, faces: Values, palette: Palette) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
    const repeated = new Float32Array(3 * faces.length);
    faces.forEach((face, k) => repeated.fill(face, 3 * k, 3 * k + 3));
    geometry.setAttribute("face", new THREE.BufferAttribute(repeated, 1));
    geometry.computeVertexNormals();
    const common = { glslVersion: THREE.GLSL3, side: THREE.DoubleSide, vertexShader: head(`in vec3 normal;\n${FACES_VERTEX}`), uniforms: { ...palette, opacity: this.opacity } };
    const offset = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    this.object = new THREE.Mesh(geometry, new THREE.RawShaderMaterial({ ...common, ...offset, fragmentShader: FACES_FRAGMENT }));
    this.picked = new THREE.Mesh(geometry, new THREE.RawShaderMaterial({ ...common, fragmentShader: PICK_FACES_FRAGMENT }));
    this.object.frustumCulled = this.picked.frustumCulled = false;
  }

  fade(opacity: number): void {
    this.opacity.value = opacity;
    this.object.material.transparent = opacity < 1;
    this.object.material.depthWrite = opacity >= 1;
    this.object.renderOrder = opacity < 1 ? 3 : 0;
  }

  dispose(): void {
    this.object.geometry.dispose();
  }
}
