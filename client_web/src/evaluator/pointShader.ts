/** What points send to an eye: the sum over the in-basis of `relume.moving.evaluate`, what they see along lobes
 * (`highlights.glances`), how the sky in highlights differs from what lobes say (`highlights.by_lights`), how other light
 * in them changes (`highlights.turning`), and where their light comes from (`bumps`), written from the ladder. Twenty
 * numbers of each point: radiance of three groups, the direction of the light, the share of the sky along the lobe, that
 * of two lamps, one of nothing, the gradient. */
import type { SurfaceBody } from "../protocol";
import { albedoOf, GROUPS, HEAD, type Kinds, LOBES, LUMINANCE, PLACE, rowOf, SKY, WIDTH } from "./common";
import { glance } from "./glanceShader";
import { byLights } from "./highlightShader";
import { turning } from "./turningShader";

const CHANNELS = [0, 1, 2];
const FOUR = "xyzw";

const float = (value: number) => (Number.isInteger(value) ? value.toFixed(1) : String(value));
/** One number of texels of four. No arrays: software rasterisers keep those in memory. */
const part = (texels: string, k: number) => `${texels}${k >> 2}.${FOUR[k & 3]}`;
const range = (count: number) => Array.from({ length: count }, (_, k) => k);
const named = (texels: string, count: number) => `vec4 ${range(count).map((k) => `${texels}${k}`).join(", ")};`;

type Sent = "plain" | "sky" | "beside";

/** What a material makes use of: the rest is not compiled in. Software takes both ways of every branch. */
export interface PointFeatures {
  /** How many functions its light vectors have; 0 where nothing asks for them. */
  functions: number;
  /** The same of those beside the sky. */
  others: number;
  /** Terms without a highlight; what those with one send of the sky, and of other light. */
  plain: Kinds;
  sky: Kinds;
  beside: Kinds;
  lobe: boolean;
  /** A normal map asks where light comes from. */
  map: boolean;
}

/** Whether pixels ask how other light in highlights changes. */
const turns = ({ lobe, beside }: PointFeatures) => lobe && beside.even.includes(true);
const isAsked = ({ even, uneven }: Kinds) => [...even, ...uneven].includes(true);

/** cos mφ and sin mφ of all orders, from those of φ. */
function turnsOf(orders: number): string {
  const lines = ["float c0 = 1.0, s0 = 0.0;"];
  for (let m = 1; m < orders; m++) {
    lines.push(`float c${m} = c${m - 1} * cp - s${m - 1} * sp, s${m} = c${m - 1} * sp + s${m - 1} * cp;`);
  }
  return lines.join("\n");
}

/** Rungs of the ladder whose functions a material's light vectors have. */
const rungsOf = ({ ladder }: SurfaceBody, { functions, others }: PointFeatures) =>
  range(ladder.order.length).filter((rung) => (ladder.cosine[rung] as number) < Math.max(functions, others));

/** One number of a light vector: they come channel by channel. That of the sky is what the others leave of all. */
function light(features: PointFeatures, of: Sent, channel: number, k: number): string {
  const number = (texels: string, count: number) => (k < count ? part(texels, channel * count + k) : "0.0");
  const [all, others] = [number("t", features.functions), number("o", features.others)];
  return of === "plain" ? all : of === "beside" ? others : `(${all} - ${others})`;
}

/** Light vectors turned to the eye's φ, rung by rung; or how they change with it. */
function turned(surface: SurfaceBody, features: PointFeatures, of: Sent, isChange = false): string {
  const { ladder } = surface;
  const lines = CHANNELS.flatMap((channel) =>
    rungsOf(surface, features).map((rung) => {
      const m = ladder.order[rung] as number;
      const cosine = light(features, of, channel, ladder.cosine[rung] as number);
      const sine = light(features, of, channel, ladder.sine[rung] as number);
      const turn = isChange ? `${m.toFixed(1)} * (c${m} * ${sine} - s${m} * ${cosine})` : `c${m} * ${cosine} + s${m} * ${sine}`;
      const value = m > 0 ? turn : isChange ? "0.0" : cosine;
      return `${part("turned", channel * ladder.order.length + rung)} = ${value};`;
    }),
  );
  return lines.join("\n");
}

/** Σ of the light, of its luminance, with an expansion. */
function expanded({ expansions }: SurfaceBody, features: PointFeatures): string {
  const sums = expansions.map((row) => {
    const parts = row.flatMap((value, k) =>
      Math.abs(value) < 1e-7
        ? []
        : [`${float(value)} * (${CHANNELS.map((c) => `${LUMINANCE[c]} * ${light(features, "plain", c, k)}`).join(" + ")})`],
    );
    return parts.join(" + ") || "0.0";
  });
  return `vec3 local = vec3(${sums.join(", ")});`;
}

/** Radiance by a table over θo alone; or how it changes from a row to the next. */
function even(surface: SurfaceBody, features: PointFeatures, isStep = false): string {
  const rungs = surface.ladder.order.length / 4;
  const used = new Set(rungsOf(surface, features));
  // texels of rungs that hold functions of high degrees alone are left out
  const lines = range(rungs).flatMap((q) => {
    const here = FOUR.split("").filter((_, k) => used.has(4 * q + k)).join("");
    if (here === "") return [];
    const sums = CHANNELS.map((channel) => channel * rungs + q).map((k) => {
      const [near, far] = ["near", "far"].map((row) => `texelFetch(uEven, at(${row} + ${k}), 0).${here}`);
      const factor = isStep ? `(${far} - ${near})` : `mix(${near}, ${far}, share)`;
      const factors = [factor, `turned${k}.${here}`].join(here.length > 1 ? ", " : " * ");
      return here.length > 1 ? `dot(${factors})` : factors;
    });
    return `sum += vec3(${sums.join(",\n    ")});`;
  });
  return `vec3 ${isStep ? "evenStep(int table, int row)" : "even(int table, int row, float share)"} {
  int near = (table * ${surface.rows} + row) * ${3 * rungs}, far = near + ${3 * rungs};
  vec3 sum = vec3(0.0);
  ${lines.join("\n  ")}
  return sum;
}`;
}

/** Radiance by a table over θo and φo. */
function uneven({ rows, columns, functions }: SurfaceBody, features: PointFeatures, of: Sent): string {
  const texels = functions / 4;
  const place = (row: string, column: string, k: number) => `texelFetch(uUneven, at((${row} + ${column}) * ${3 * texels} + ${k}), 0)`;
  const sums = CHANNELS.map((channel) =>
    range(Math.ceil(Math.max(features.functions, features.others) / 4))
      .map((q) => {
        const k = channel * texels + q;
        const [near, far] = ["near", "far"].map((row) => `mix(${place(row, "column", k)}, ${place(row, "beside", k)}, part)`);
        return `dot(mix(${near}, ${far}, share), vec4(${range(4).map((n) => light(features, of, channel, 4 * q + n)).join(", ")}))`;
      })
      .join(" +\n    "),
  );
  return `vec3 ${of}Uneven(int table, int row, float share, float cp, float sp) {
  float place = fract(atan(sp, cp) / 6.28318530718) * ${columns.toFixed(1)};
  int column = min(int(place), ${columns - 1}), beside = (column + 1) % ${columns};
  float part = place - float(column);
  int near = (table * ${rows} + row) * ${columns}, far = near + ${columns};
  return vec3(${sums.join(",\n    ")});
}`;
}

/** What is sent by tables of a kind, each group a vector: `name` and its number. */
function sum(surface: SurfaceBody, features: PointFeatures, of: Sent, name: string): string {
  const { even, uneven } = features[of];
  const table = (group: number, k: number) => (of === "plain" ? `uTables[${group}].${FOUR[k]}` : `uHighlights[${group}].${FOUR[(of === "sky" ? 0 : 2) + k]}`);
  const groups = range(GROUPS).map((group) => {
    const parts = [even[group] && `even(${table(group, 0)}, row, share)`, uneven[group] && `${of}Uneven(${table(group, 1)}, row, share, cp, sp)`];
    return `vec3 ${name}${group} = ${parts.filter(Boolean).join(" + ") || "vec3(0.0)"};`;
  });
  return `${even.includes(true) ? turned(surface, features, of) : ""}
  ${groups.join("\n  ")}`;
}

/** The sky in highlights, less what pixels find in lobes: what the in-basis says, within what two lobes allow; or lights. */
function sky(surface: SurfaceBody, features: PointFeatures): string {
  const isTold = isAsked(features.sky);
  const told = (group: number) => `clamp(told${group}, albedo / most, albedo * most) - albedo`;
  const add = (group: number) =>
    `albedo = ${albedoOf(`of - ${GROUPS - group}`)} * ${isTold ? "both" : "rest"}; sent${group} += ${isTold ? told(group) : "albedo"};`;
  const found = isTold
    ? `${sum(surface, features, "sky", "told")}
  float most = texelFetch(uLobes, at(of - ${GROUPS}), 0).a;`
    : `float believed, flatly;
  vec3 rest = uSkyGain * byLights(p, row, share, n, wo, cosine, believed, flatly);
  rest = flatly * (rest - (1.0 - believed) * both);`;
  return `vec3 both = skyInBoth(lobes, glance.xyz), albedo;
  ${found}
  ${range(GROUPS).map(add).join("\n  ")}`;
}

const UNIFORMS = `
uniform sampler2D uVectors, uOthers, uPlaces, uPointNormals, uTangents, uEven, uUneven;
uniform int uFirst, uLobe;
uniform ivec2 uTables[${GROUPS}];
uniform ivec4 uHighlights[${GROUPS}];
uniform float uScale, uOthersScale;
uniform vec3 uEye;
`;

/** Loads so many numbers of a point from an array of whole texels. */
const loaded = (into: string, array: string, scale: string, numbers: number) =>
  range(Math.ceil(numbers / 4))
    .map((q) => `${into}${q} = ${scale} * texelFetch(${array}, at((p - uFirst) * ${Math.ceil(numbers / 4)} + ${q}), 0);`)
    .join(" ");

/** Four numbers each, for which there is a layer. */
export const outputs = (layers: readonly number[]) => layers.map((layer, k) => `layout(location = ${k}) out vec4 out${layer};`).join("\n");

/** Functions and what they share. */
function declared(surface: SurfaceBody, features: PointFeatures): string {
  const kinds = (["plain", "sky", "beside"] as const).filter((of) => isAsked(features[of]));
  const isEven = kinds.some((of) => features[of].even.includes(true));
  const numbers = (texels: string, count: number) => (count > 0 ? named(texels, Math.ceil((3 * count) / 4)) : "");
  return `${numbers("t", features.functions)}
${numbers("o", features.others)}
${isEven ? `${named("turned", 3 * (surface.ladder.order.length / 4))}\n${even(surface, features)}` : ""}
${turns(features) ? even(surface, features, true) : ""}
${kinds.filter((of) => features[of].uneven.includes(true)).map((of) => uneven(surface, features, of)).join("\n")}`;
}

export function pointShader(surface: SurfaceBody, features: PointFeatures, layers: readonly number[]): string {
  const { functions, others, lobe, map, beside } = features;
  const orders = rungsOf(surface, features).map((rung) => surface.ladder.order[rung] as number);
  const besides = `${sum(surface, features, "beside", "beside")}
  ${range(GROUPS).map((group) => `sent${group} += max(beside${group}, 0.0);`).join(" ")}
  ${turns(features) ? turning(surface, beside, turned(surface, features, "beside", true)) : ""}`;
  const looked = `int of = (uLobe * ${surface.rows} + row) * ${GROUPS + 1} + ${GROUPS};
  Lobes lobes = alongBoth(of, share, n, -wo);
  glance.xyz = glanceAlong(lobes, p);
  ${sky(surface, features)}`;
  const values = ["vec4(sent0, sent1.r)", "vec4(sent1.gb, sent2.rg)", "vec4(sent2.b, towards)", "glance", "turn"];
  return `${HEAD}${rowOf(surface.rows)}${lobe ? `${PLACE}${SKY}${LOBES}${glance(surface)}${isAsked(features.sky) ? "" : byLights(surface)}` : ""}${UNIFORMS}
${outputs(layers)}
${declared(surface, features)}
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
  ${loaded("o", "uOthers", "uOthersScale", 3 * others)}
  ${orders.length > 0 ? turnsOf(Math.max(...orders) + 1) : ""}
  ${sum(surface, features, "plain", "sent")}
  vec4 turn = vec4(0.0);
  ${isAsked(beside) ? besides : ""}

  vec3 towards = vec3(0.0);
  ${map ? `${expanded(surface, features)}\n  towards = local.x * tangent + local.y * bitangent + local.z * n;` : ""}
  vec4 glance = vec4(0.0);
  ${lobe ? looked : ""}
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
