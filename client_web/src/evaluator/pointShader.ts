/** What points send to an eye: the sum over the in-basis of `relume.moving.evaluate`, its looks along lobes
 * (`glints`), less the sky in these (`between_points`), and where their light comes from (`bumps`), written from the
 * ladder. Sixteen numbers of each point: radiance of three groups, the direction of the light, the share of the sky along
 * the lobe, radiance beside it. */
import type { SurfaceBody } from "../protocol";
import { albedoOf, GROUPS, HEAD, LOBES, PLACE, rowOf, SKY, WIDTH } from "./common";

const CHANNELS = [0, 1, 2];
const LUMINANCE = [0.2126, 0.7152, 0.0722];
const FOUR = "xyzw";

const float = (value: number) => (Number.isInteger(value) ? value.toFixed(1) : String(value));
/** One number of texels of four. No arrays: software rasterisers keep those in memory. */
const part = (texels: string, k: number) => `${texels}${k >> 2}.${FOUR[k & 3]}`;
const range = (count: number) => Array.from({ length: count }, (_, k) => k);
const named = (texels: string, count: number) => `vec4 ${range(count).map((k) => `${texels}${k}`).join(", ")};`;

/** What a material makes use of: the rest is not compiled in. Software takes both ways of every branch. */
export interface PointFeatures {
  /** How many functions its light vectors have; 0 where nothing asks for them. */
  functions: number;
  /** Which groups have a table of each kind. */
  even: readonly boolean[];
  uneven: readonly boolean[];
  /** Its lobe: none, one that the in-basis tells, or one that is too narrow for that. */
  lobe: "none" | "told" | "narrow";
  /** How many functions the light vectors beside the sky have, which narrow lobes look at. */
  others: number;
  /** A normal map asks where light comes from. */
  map: boolean;
}

/** cos mφ and sin mφ of all orders, from those of φ. */
function turns(orders: number): string {
  const lines = ["float c0 = 1.0, s0 = 0.0;"];
  for (let m = 1; m < orders; m++) {
    lines.push(`float c${m} = c${m - 1} * cp - s${m - 1} * sp, s${m} = c${m - 1} * sp + s${m - 1} * cp;`);
  }
  return lines.join("\n");
}

/** Rungs of the ladder whose functions a material's light vectors have. */
const rungsBelow = ({ ladder }: SurfaceBody, functions: number) =>
  range(ladder.order.length).filter((rung) => (ladder.cosine[rung] as number) < functions);

/** One number of a light vector: they come channel by channel. */
const light = ({ functions }: PointFeatures, channel: number, k: number) =>
  k < functions ? part("t", channel * functions + k) : "0.0";

/** Light vectors turned to the eye's φ, rung by rung. */
function turned(surface: SurfaceBody, features: PointFeatures): string {
  const { ladder } = surface;
  const lines = CHANNELS.flatMap((channel) =>
    rungsBelow(surface, features.functions).map((rung) => {
      const m = ladder.order[rung] as number;
      const cosine = light(features, channel, ladder.cosine[rung] as number);
      const sine = light(features, channel, ladder.sine[rung] as number);
      const value = m === 0 ? cosine : `c${m} * ${cosine} + s${m} * ${sine}`;
      return `${part("turned", channel * ladder.order.length + rung)} = ${value};`;
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
function expanded({ expansions }: SurfaceBody, features: PointFeatures): string {
  const sums = expansions.map((row) => {
    const parts = row.flatMap((value, k) =>
      Math.abs(value) < 1e-7
        ? []
        : [`${float(value)} * (${CHANNELS.map((c) => `${LUMINANCE[c]} * ${light(features, c, k)}`).join(" + ")})`],
    );
    return parts.join(" + ") || "0.0";
  });
  return `vec3 local = vec3(${sums.join(", ")});`;
}

/** Radiance by a table over θo alone. */
function even(surface: SurfaceBody, { functions }: PointFeatures): string {
  const rungs = surface.ladder.order.length / 4;
  const used = new Set(rungsBelow(surface, functions));
  // texels of rungs that hold functions of high degrees alone are left out
  const lines = range(rungs).flatMap((q) => {
    const here = FOUR.split("").filter((_, k) => used.has(4 * q + k)).join("");
    if (here === "") return [];
    const sums = CHANNELS.map((channel) => channel * rungs + q).map((k) => {
      const table = ["near", "far"].map((row) => `texelFetch(uEven, at(${row} + ${k}), 0).${here}`).join(", ");
      const factors = [`mix(${table}, share)`, `turned${k}.${here}`].join(here.length > 1 ? ", " : " * ");
      return here.length > 1 ? `dot(${factors})` : factors;
    });
    return `sum += vec3(${sums.join(",\n    ")});`;
  });
  return `vec3 even(int table, int row, float share) {
  int near = (table * ${surface.rows} + row) * ${3 * rungs}, far = near + ${3 * rungs};
  vec3 sum = vec3(0.0);
  ${lines.join("\n  ")}
  return sum;
}`;
}

/** Radiance by a table over θo and φo. */
function uneven({ rows, columns, functions }: SurfaceBody, features: PointFeatures): string {
  const texels = functions / 4;
  const place = (row: string, column: string, k: number) => `texelFetch(uUneven, at((${row} + ${column}) * ${3 * texels} + ${k}), 0)`;
  const sums = CHANNELS.map((channel) =>
    range(Math.ceil(features.functions / 4))
      .map((q) => {
        const k = channel * texels + q;
        const [near, far] = ["near", "far"].map((row) => `mix(${place(row, "column", k)}, ${place(row, "beside", k)}, part)`);
        return `dot(mix(${near}, ${far}, share), vec4(${range(4).map((n) => light(features, channel, 4 * q + n)).join(", ")}))`;
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

/** Loads so many numbers of a point from an array of whole texels. */
const loaded = (into: string, array: string, scale: string, numbers: number) =>
  range(Math.ceil(numbers / 4))
    .map((q) => `${into}${q} = ${scale} * texelFetch(${array}, at((p - uFirst) * ${Math.ceil(numbers / 4)} + ${q}), 0);`)
    .join(" ");

/** A look along the lobe. */
function glance(surface: SurfaceBody, { lobe, others }: PointFeatures): string {
  const texels = surface.functions / 4;
  const seen = (channel: number) =>
    range(others).map((k) => `${part("h", k)} * ${part("o", channel * others + k)}`).join(" + ") || "0.0";
  const told = `vec3 light = glance.x * uSkyGain * skyAbout(r, shape.y);
    ${range(GROUPS).map((group) => `sent${group} -= light * ${albedoOf(`of - ${GROUPS - group}`)};`).join("\n    ")}`;
  const narrow = `${named("o", Math.max(1, Math.ceil((3 * others) / 4)))}
    ${loaded("o", "uOthers", "uOthersScale", 3 * others)}
    glance.yzw = max(vec3(${CHANNELS.map(seen).join(",\n      ")}), 0.0);`;
  return `int of = (uLobe * ${surface.rows} + row) * ${GROUPS + 1} + ${GROUPS};
    vec3 shape, r = alongLobe(of, share, n, -wo, shape);
    vec2 w = vec2(dot(tangent, r), dot(bitangent, r));
    ${named("h", texels)}
    ${functionsAt(surface)}
    float open = ${range(texels).map((q) => `dot(h${q}, texelFetch(uSkyShare, at(p * ${texels} + ${q}), 0))`).join(" + ")};
    glance.x = clamp(open, 0.0, 1.0);
    ${lobe === "told" ? told : narrow}`;
}

const UNIFORMS = `
uniform sampler2D uVectors, uOthers, uSkyShare, uPlaces, uPointNormals, uTangents, uEven, uUneven;
uniform int uFirst, uLobe;
uniform ivec2 uTables[${GROUPS}];
uniform float uScale, uOthersScale;
uniform vec3 uEye;
`;

/** Four numbers each, for which there is a layer. */
export const outputs = (layers: readonly number[]) => layers.map((layer, k) => `layout(location = ${k}) out vec4 out${layer};`).join("\n");

export function pointShader(surface: SurfaceBody, features: PointFeatures, layers: readonly number[]): string {
  const { functions, lobe, map } = features;
  const [isEven, isUneven] = [features.even.includes(true), features.uneven.includes(true)];
  const sent = (group: number) => `vec3 sent${group} = vec3(0.0);
  ${features.even[group] ? `sent${group} += even(uTables[${group}].x, row, share);` : ""}
  ${features.uneven[group] ? `sent${group} += uneven(uTables[${group}].y, row, share, cp, sp);` : ""}`;
  const values = ["vec4(sent0, sent1.r)", "vec4(sent1.gb, sent2.rg)", "vec4(sent2.b, towards)", "glance"];
  return `${HEAD}${rowOf(surface.rows)}${lobe === "none" ? "" : `${PLACE}${SKY}${LOBES}`}${UNIFORMS}
${outputs(layers)}
${functions > 0 ? named("t", Math.ceil((3 * functions) / 4)) : ""}
${isEven ? `${named("turned", 3 * (surface.ladder.order.length / 4))}\n${even(surface, features)}` : ""}
${isUneven ? uneven(surface, features) : ""}
void main() {
  int p = int(gl_FragCoord.y) * ${WIDTH} + int(gl_FragCoord.x);
  vec3 n = texelFetch(uPointNormals, at(p), 0).xyz, tangent = texelFetch(uTangents, at(p), 0).xyz;
  vec3 bitangent = cross(n, tangent), wo = uEye - texelFetch(uPlaces, at(p), 0).xyz;
  wo *= inversesqrt(max(dot(wo, wo), 1e-20));
  float across = dot(tangent, wo), along = dot(bitangent, wo), cosine = clamp(dot(n, wo), 0.01, 1.0), share;
  float flatness = sqrt(across * across + along * along);
  float cp = flatness < 1e-6 ? 1.0 : across / flatness, sp = flatness < 1e-6 ? 0.0 : along / flatness;
  int row = rowOf(cosine, share);

  ${loaded("t", "uVectors", "uScale", 3 * functions)}
  ${isEven ? `${turns(Math.max(...rungsBelow(surface, functions).map((rung) => surface.ladder.order[rung] as number)) + 1)}\n${turned(surface, features)}` : ""}
  ${range(GROUPS).map(sent).join("\n  ")}

  vec3 towards = vec3(0.0);
  ${map ? `${expanded(surface, features)}\n  towards = local.x * tangent + local.y * bitangent + local.z * n;` : ""}
  vec4 glance = vec4(0.0);
  ${lobe === "none" ? "" : glance(surface, features)}
  ${layers.map((layer) => `out${layer} = ${values[layer]};`).join("\n  ")}
}
`;
}

/** What slots take from the points about them. */
export function slotShader(layers: readonly number[]): string {
  const take = (k: string) => `p = at(int(points.${k}));
  ${layers.map((layer) => `out${layer} += weights.${k} * texelFetch(uValues, ivec3(p, ${layer}), 0);`).join("\n  ")}`;
  return `${HEAD}
uniform usampler2D uPoints;
uniform sampler2D uWeights;
uniform sampler2DArray uValues;
${outputs(layers)}
void main() {
  ivec2 here = ivec2(gl_FragCoord.xy), p;
  uvec4 points = texelFetch(uPoints, here, 0);
  vec4 weights = texelFetch(uWeights, here, 0);
  ${layers.map((layer) => `out${layer} = vec4(0.0);`).join(" ")}
  ${["x", "y", "z", "w"].map(take).join("\n  ")}
}
`;
}
