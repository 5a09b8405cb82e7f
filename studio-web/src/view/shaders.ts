/** The programs of the graphics card. Points and faces look their colours up, so that a slider only moves a number. */
const COMMON = /* glsl */ `
precision highp float;
precision highp int;
uniform sampler2D palette;
uniform float paletteSize;
vec3 faceColour(float face) {
  return face < 0.0 ? vec3(0.42, 0.44, 0.47) : texture(palette, vec2((face + 0.5) / paletteSize, 0.5)).rgb;
}
`;

const PLACE = /* glsl */ `
in float strength;
in float corrected;
in float face;
uniform float scale;      // pixels of a unit, at distance one in perspective
uniform bool perspective;
uniform float size;       // of a point, in the scan's unit
uniform float least;      // pixels
void place() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * seen;
  gl_PointSize = clamp(size * scale / (perspective ? -seen.z : 1.0), least, 40.0);
}
`;

export const POINTS_VERTEX = /* glsl */ `
${COMMON}
${PLACE}
in float deviation;
in float dn;
in float vdn;
in float chosen;
in vec3 shadeNormal;
uniform int colouring;    // 0 plain, 1 height, 2 strength, 3 face, 4 deviation
uniform float threshold;
uniform float alpha;
uniform bool weighted;
uniform vec2 range;
uniform sampler2D ramp;
uniform bool shaded;
out vec3 colour;
vec3 ramped(float value) {
  return texture(ramp, vec2(clamp((value - range.x) / max(range.y - range.x, 1e-30), 0.0, 1.0), 0.5)).rgb;
}
void main() {
  place();
  vec3 base = vec3(0.72, 0.76, 0.80);
  colour = base;
  if (colouring == 1) colour = ramped(position.z);
  if (colouring == 2) {
    float value = weighted ? alpha * dn + (1.0 - alpha) * vdn : strength;
    bool edge = corrected == 1.0 || (corrected != 2.0 && value > threshold);
    colour = edge ? ramped(max(value, 0.0)) : vec3(0.45, 0.53, 0.60);
    if (corrected == 1.0) colour = vec3(0.30, 0.90, 0.55);
    if (corrected == 2.0) colour = vec3(0.62, 0.45, 0.85);
  }
  if (colouring == 3) colour = faceColour(face);
  if (colouring == 4) colour = deviation > 1e29 ? vec3(0.35) : ramped(deviation);
  if (shaded) {
    vec3 n = shadeNormal * 2.0 - 1.0;
    float length2 = dot(n, n);
    if (length2 > 0.25) {
      vec3 view = perspective ? normalize((modelViewMatrix * vec4(position, 1.0)).xyz) : vec3(0.0, 0.0, 1.0);
      float light = abs(dot(normalize(normalMatrix * n), view));
      colour *= colouring == 2 ? 0.7 + 0.3 * light : 0.45 + 0.6 * light;
    }
  }
  if (chosen > 0.5) { colour = mix(colour, vec3(1.0, 0.95, 0.2), 0.85); gl_PointSize += 2.0; }
}`;

export const POINTS_FRAGMENT = /* glsl */ `
precision highp float;
in vec3 colour;
uniform float opacity;
out vec4 result;
void main() {
  vec2 at = gl_PointCoord - 0.5;
  if (dot(at, at) > 0.25) discard;
  result = vec4(colour, opacity);
}`;

export const PICK_POINTS_VERTEX = /* glsl */ `
${COMMON}
${PLACE}
flat out uvec4 found;
void main() {
  place();
  float depth = -(modelViewMatrix * vec4(position, 1.0)).z;
  found = uvec4(uint(max(face, -1.0) + 1.0), floatBitsToUint(depth), 0u, 1u);
}`;

export const FACES_VERTEX = /* glsl */ `
${COMMON}
in float face;
out vec3 colour;
out vec3 turned;
flat out uvec4 found;
out float depth;
void main() {
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * seen;
  colour = faceColour(face);
  turned = normalMatrix * normal;
  depth = -seen.z;
  found = uvec4(uint(max(face, -1.0) + 1.0), 0u, 0u, 1u);
}`;

export const FACES_FRAGMENT = /* glsl */ `
precision highp float;
in vec3 colour;
in vec3 turned;
uniform float opacity;
out vec4 result;
void main() {
  vec3 n = normalize(turned);
  float light = 0.38 + 0.5 * abs(n.z) + 0.16 * abs(dot(n, normalize(vec3(0.4, 0.8, 0.3))));
  result = vec4(colour * light, opacity);
}`;

export const PICK_FRAGMENT = /* glsl */ `
precision highp float;
precision highp int;
flat in uvec4 found;
layout(location = 0) out uvec4 result;
void main() { result = found; }`;

export const PICK_FACES_FRAGMENT = /* glsl */ `
precision highp float;
precision highp int;
flat in uvec4 found;
in float depth;
layout(location = 0) out uvec4 result;
void main() { result = uvec4(found.x, floatBitsToUint(depth), found.zw); }`;
