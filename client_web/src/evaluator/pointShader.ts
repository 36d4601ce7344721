/** What points send to an eye: the sum over the in-basis of `relume.moving.evaluate`, its looks along lobes
 * (`glints`), less the sky in these (`between_points`), and where their light comes from (`bumps`), written from the ladder. Sixteen numbers of each point:
 * radiance of three groups, the direction of the light, the share of the sky along the lobe, radiance beside it. */
import type { SurfaceBody } from "../protocol";
import { albedoOf, GROUPS, HEAD, LOBES, MATERIAL, PLACE, rowOf, SKY } from "./common";

const CHANNELS = [0, 1, 2];
const LUMINANCE = [0.2126, 0.7152, 0.0722];
const FOUR = "xyzw";

const float = (value: number) => (Number.isInteger(value) ? value.toFixed(1) : String(value));
/** One number of texels of four. No arrays: software rasterisers keep those in memory. */
const part = (texels: string, k: number) => `${texels}${k >> 2}.${FOUR[k & 3]}`;
const range = (count: number) => Array.from({ length: count }, (_, k) => k);
const named = (texels: string, count: number) => `vec4 ${range(count).map((k) => `${texels}${k}`).join(", ")};`;

/** What a look makes use of: the rest is not compiled in. */
export interface PointFeatures {
  uneven: boolean;
  lobes: boolean;
  maps: boolean;
}

/** cos mφ and sin mφ of all orders, from those of φ. */
function turns(orders: number): string {
  const lines = ["float c0 = 1.0, s0 = 0.0;"];
  for (let m = 1; m < orders; m++) {
    lines.push(`float c${m} = c${m - 1} * cp - s${m - 1} * sp, s${m} = c${m - 1} * sp + s${m - 1} * cp;`);
  }
  return lines.join("\n");
}

/** Light vectors turned to the eye's φ, rung by rung. */
function turned({ ladder, functions }: SurfaceBody): string {
  const rungs = ladder.order.length;
  const lines = CHANNELS.flatMap((channel) =>
    ladder.order.map((m, rung) => {
      const cosine = part("t", channel * functions + (ladder.cosine[rung] as number));
      const sine = part("t", channel * functions + (ladder.sine[rung] as number));
      const value = m === 0 ? cosine : `c${m} * ${cosine} + s${m} * ${sine}`;
      return `${part("turned", channel * rungs + rung)} = ${value};`;
    }),
  );
  return lines.join("\n");
}

/** All functions in the direction whose place in the disc is \`w\`. */
function functionsAt({ ladder }: SurfaceBody): string {
  const lines = ["float x = 2.0 * dot(w, w) - 1.0, re = 1.0, im = 0.0, before = 0.0, last = 1.0, older, turn, value;"];
  ladder.order.forEach((m, rung) => {
    const [a, b, c, norm] = [ladder.a[rung], ladder.b[rung], ladder.c[rung], ladder.norm[rung]].map((value) =>
      float(value as number),
    );
    if (ladder.a[rung] === 0) {
      if (m > 0) lines.push("turn = re * w.x - im * w.y; im = re * w.y + im * w.x; re = turn;");
      lines.push("before = 0.0; last = 1.0;");
    } else lines.push(`older = last; last = (${a} * x + ${b}) * older - ${c} * before; before = older;`);
    lines.push(`${part("h", ladder.cosine[rung] as number)} = ${norm} * last * re;`);
    if (m > 0) lines.push(`${part("h", ladder.sine[rung] as number)} = ${norm} * last * im;`);
  });
  return lines.join("\n");
}

/** Σ of the light, of its luminance, with an expansion. */
function expanded({ expansions, functions }: SurfaceBody): string {
  const sums = expansions.map((row) => {
    const parts = row.flatMap((value, k) =>
      Math.abs(value) < 1e-7
        ? []
        : [`${float(value)} * (${CHANNELS.map((c) => `${LUMINANCE[c]} * ${part("t", c * functions + k)}`).join(" + ")})`],
    );
    return parts.join(" + ") || "0.0";
  });
  return `vec3 local = vec3(${sums.join(", ")});`;
}

/** Radiance by a table over θo alone. */
function even({ rows, ladder }: SurfaceBody): string {
  const rungs = ladder.order.length / 4;
  // texels of rungs that hold functions of high degrees alone are left out where few texels of light vectors are needed
  const lines = range(rungs).map((q) => {
    const least = Math.min(...range(4).map((k) => ladder.cosine[4 * q + k] as number)) >> 2;
    const sums = CHANNELS.map((channel) => channel * rungs + q).map(
      (k) => `dot(mix(texelFetch(uEven, at(near + ${k}), 0), texelFetch(uEven, at(far + ${k}), 0), share), turned${k})`,
    );
    return `if (needed > ${least}) sum += vec3(${sums.join(",\n    ")});`;
  });
  return `vec3 even(int table, int row, float share, int needed) {
  int near = (table * ${rows} + row) * ${3 * rungs}, far = near + ${3 * rungs};
  vec3 sum = vec3(0.0);
  ${lines.join("\n  ")}
  return sum;
}`;
}

/** Radiance by a table over θo and φo. */
function uneven({ rows, columns, functions }: SurfaceBody): string {
  const texels = functions / 4;
  const place = (row: string, column: string, k: number) => `texelFetch(uUneven, at((${row} + ${column}) * ${3 * texels} + ${k}), 0)`;
  const sums = CHANNELS.map((channel) =>
    range(texels)
      .map((q) => channel * texels + q)
      .map((k) => {
        const [near, far] = ["near", "far"].map((row) => `mix(${place(row, "column", k)}, ${place(row, "beside", k)}, part)`);
        return `dot(mix(${near}, ${far}, share), t${k})`;
      })
      .join(" +\n    "),
  );
  return `vec3 uneven(int table, int row, float share, float cp, float sp) {
  float place = fract(atan(sp, cp) / 6.28318530718) * ${columns.toFixed(1)};
  int column = min(int(place), ${columns - 1}), beside = (column + 1) % ${columns};
  float part = place - float(column);
  int near = (table * ${rows} + row) * ${columns}, far = near + ${columns};
  return vec3(${sums.join(",\n    ")});
}`;
}

/** A look along the lobe. */
function glance(surface: SurfaceBody): string {
  const texels = surface.functions / 4;
  const others = (channel: number, q: number) =>
    `dot(h${q}, ${q} < uOthersStride ? texelFetch(uOthers, at((p * 3 + ${channel}) * uOthersStride + ${q}), 0) : vec4(0.0))`;
  const sums = CHANNELS.map((channel) => range(texels).map((q) => others(channel, q)).join(" + "));
  return `int lobe = texelFetch(uMaterials, at(material + ${GROUPS}), 0).x;
  if (lobe >= 0) {
    int of = (lobe * ${surface.rows} + row) * ${GROUPS + 1} + ${GROUPS};
    vec3 shape, r = alongLobe(of, share, n, -wo, shape);
    vec2 w = vec2(dot(tangent, r), dot(bitangent, r));
    ${named("h", texels)}
    ${functionsAt(surface)}
    float open = ${range(texels).map((q) => `dot(h${q}, texelFetch(uSkyShare, at(p * ${texels} + ${q}), 0))`).join(" + ")};
    glance.x = clamp(open, 0.0, 1.0);
    if (shape.z > 0.0) {
      vec3 light = glance.x * uSkyGain * skyAbout(r, shape.y);
      ${range(GROUPS).map((group) => `sent${group} -= light * ${albedoOf(`of - ${GROUPS - group}`)};`).join("\n      ")}
    } else glance.yzw = max(uOthersScale * vec3(${sums.join(",\n      ")}), 0.0);
  }`;
}

export function pointShader(surface: SurfaceBody, features: PointFeatures): string {
  const { functions, rows, ladder } = surface;
  const [vectors, rungs] = [functions / 4, ladder.order.length / 4]; // texels of each
  const texel = (channel: number, q: number) =>
    `t${channel * vectors + q} = uScale * texelFetch(uVectors, at((p * 3 + ${channel}) * uStride + ${q}), 0);`;
  const load = (q: number) => `if (${q} < texels) { ${CHANNELS.map((channel) => texel(channel, q)).join(" ")} }`;
  const sent = (group: number) => `vec3 sent${group} = vec3(0.0);
  tables = texelFetch(uMaterials, at(material + ${group}), 0);
  if (tables.x >= 0) sent${group} += even(tables.x, row, share, needed);
  ${features.uneven ? `if (tables.y >= 0) sent${group} += uneven(tables.y, row, share, cp, sp);` : ""}`;
  return `${HEAD}${rowOf(rows)}${features.lobes ? `${PLACE}${SKY}${LOBES}` : ""}
uniform sampler2D uVectors, uOthers, uSkyShare, uPlaces, uPointNormals, uTangents, uEven, uUneven;
uniform isampler2D uMaterials;
uniform int uNumPoints, uStride, uOthersStride;
uniform float uScale, uOthersScale;
uniform vec3 uEye;
layout(location = 0) out vec4 out0;
layout(location = 1) out vec4 out1;
layout(location = 2) out vec4 out2;
layout(location = 3) out vec4 out3;
${named("t", 3 * vectors)}
${named("turned", 3 * rungs)}
${even(surface)}
${features.uneven ? uneven(surface) : ""}

void main() {
  int p = int(gl_FragCoord.y) * 2048 + int(gl_FragCoord.x);
  if (p >= uNumPoints) discard;
  vec4 place = texelFetch(uPlaces, at(p), 0);
  int material = int(place.w) * ${MATERIAL};
  vec3 n = texelFetch(uPointNormals, at(p), 0).xyz, tangent = texelFetch(uTangents, at(p), 0).xyz;
  vec3 bitangent = cross(n, tangent), wo = uEye - place.xyz;
  wo *= inversesqrt(max(dot(wo, wo), 1e-20));
  float across = dot(tangent, wo), along = dot(bitangent, wo), cosine = clamp(dot(n, wo), 0.01, 1.0), share;
  float flatness = sqrt(across * across + along * along);
  float cp = flatness < 1e-6 ? 1.0 : across / flatness, sp = flatness < 1e-6 ? 0.0 : along / flatness;
  int row = rowOf(cosine, share);

  int needed = texelFetch(uMaterials, at(material + ${GROUPS}), 0).w, texels = min(uStride, needed);
  ${range(3 * vectors).map((k) => `t${k}`).join(" = ")} = vec4(0.0);
  ${range(vectors).map(load).join("\n  ")}
  turned0.x = t0.x; turned${rungs}.x = t${vectors}.x; turned${2 * rungs}.x = t${2 * vectors}.x;
  if (needed > 1) {
    ${turns(Math.max(...ladder.order) + 1)}
    ${turned(surface)}
  }

  ivec4 tables;
  ${range(GROUPS).map(sent).join("\n  ")}

  vec3 towards = vec3(0.0);
  ${features.maps ? `${expanded(surface)}\n  towards = local.x * tangent + local.y * bitangent + local.z * n;` : ""}
  vec4 glance = vec4(0.0);
  ${features.lobes ? glance(surface) : ""}
  out0 = vec4(sent0, sent1.r);
  out1 = vec4(sent1.gb, sent2.rg);
  out2 = vec4(sent2.b, towards);
  out3 = glance;
}
`;
}

/** What vertices take from the points about them; layers that nothing of a look is in are left at nothing. */
export function vertexShader(layers: readonly number[]): string {
  const take = (k: string) => `if (weights.${k} > 0.0) {
    ivec2 p = at(int(points.${k}));
    ${layers.map((layer) => `out${layer} += weights.${k} * texelFetch(uValues, ivec3(p, ${layer}), 0);`).join("\n    ")}
  }`;
  return `${HEAD}
uniform usampler2D uPoints;
uniform sampler2D uWeights;
uniform sampler2DArray uValues;
uniform int uNumVertices;
layout(location = 0) out vec4 out0;
layout(location = 1) out vec4 out1;
layout(location = 2) out vec4 out2;
layout(location = 3) out vec4 out3;
void main() {
  int v = int(gl_FragCoord.y) * 2048 + int(gl_FragCoord.x);
  if (v >= uNumVertices) discard;
  uvec4 points = texelFetch(uPoints, at(v), 0);
  vec4 weights = texelFetch(uWeights, at(v), 0);
  out0 = out1 = out2 = out3 = vec4(0.0);
  ${["x", "y", "z", "w"].map(take).join("\n  ")}
}
`;
}
