/** Outgoing radiance of the probes, generated from the recurrence table: the sum over the Zernike basis of
 * `relume.live.free_camera.shade_probes`; from `highlights`, the `lobe_visibility`, the difference of the environment's highlights
 * from the lobes (`light_sum_kernel`) and the `lobe_gradients` of other light; and the mean direction of incident light for normal
 * maps. Twenty numbers per probe: radiance of three groups, the light direction, the visible fraction of the environment in the
 * lobe and of two bright lights, one unused, the gradient. */
import type { FreeCameraBody } from "../../protocol";
import {
  albedoGlsl,
  NUM_GROUPS,
  SHADER_HEADER,
  type TableKinds,
  LOBES_GLSL,
  LUMINANCE,
  EQUIRECTANGULAR_GLSL,
  elevationRowGlsl,
  ENVIRONMENT_GLSL,
  TEXELS_PER_ROW,
} from "./dataLayout";
import { lobeVisibilityGlsl } from "./lobeVisibilityShader";
import { highlightGlsl } from "./highlightShader";
import { lobeGradientGlsl } from "./lobeGradientShader";

const CHANNELS = [0, 1, 2];
const COMPONENTS = "xyzw";

const floatLiteral = (value: number) => (Number.isInteger(value) ? value.toFixed(1) : String(value));
/** One component of four-component texels. No GLSL arrays: software rasterizers keep those in memory. */
const texelPart = (texels: string, k: number) => `${texels}${k >> 2}.${COMPONENTS[k & 3]}`;
const indexRange = (count: number) => Array.from({ length: count }, (_, k) => k);
const namedTexels = (texels: string, count: number) =>
  `vec4 ${indexRange(count)
    .map((k) => `${texels}${k}`)
    .join(", ")};`;

type TableKind = "plain" | "environment" | "otherLight";

/** Features of a material: only these are compiled, since software renderers execute both sides of every branch. */
export interface ProbeFeatures {
  /** Number of functions of its incident radiance coefficients; 0 if unused. */
  functions: number;
  /** The same for light except the environment. */
  otherFunctions: number;
  /** Tables of terms without a highlight; tables of terms with one, for the environment and for other light. */
  plain: TableKinds;
  environment: TableKinds;
  otherLight: TableKinds;
  lobe: boolean;
  /** A normal map needs the mean light direction. */
  map: boolean;
}

/** True if the pixels need the gradient of other light in highlights. */
const hasGradients = ({ lobe, otherLight }: ProbeFeatures) => lobe && otherLight.isotropic.includes(true);
const hasTables = ({ isotropic, anisotropic }: TableKinds) => [...isotropic, ...anisotropic].includes(true);

/** cos mφ and sin mφ of all orders by recurrence. */
function rotationGlsl(orders: number): string {
  const lines = ["float c0 = 1.0, s0 = 0.0;"];
  for (let m = 1; m < orders; m++) {
    lines.push(`float c${m} = c${m - 1} * cp - s${m - 1} * sp, s${m} = c${m - 1} * sp + s${m - 1} * cp;`);
  }
  return lines.join("\n");
}

/** Rows of the recurrence table for the functions of a material's coefficients. */
const basisGlsl = ({ recurrence }: FreeCameraBody, { functions, otherFunctions }: ProbeFeatures) =>
  indexRange(recurrence.order.length).filter(
    (row) => (recurrence.cosine[row] as number) < Math.max(functions, otherFunctions),
  );

/** One incident radiance coefficient, stored channel by channel. The environment's is all light minus other light. */
function loadLightGlsl(features: ProbeFeatures, quantity: TableKind, channel: number, k: number): string {
  const number = (texels: string, count: number) => (k < count ? texelPart(texels, channel * count + k) : "0.0");
  const [all, otherCoefficients] = [number("t", features.functions), number("o", features.otherFunctions)];
  return quantity === "plain" ? all : quantity === "otherLight" ? otherCoefficients : `(${all} - ${otherCoefficients})`;
}

/** Incident radiance coefficients rotated to the camera's φ, row by row, or their derivative by φ. */
function rotatedGlsl(surface: FreeCameraBody, features: ProbeFeatures, quantity: TableKind, isChange = false): string {
  const { recurrence } = surface;
  const lines = CHANNELS.flatMap((channel) =>
    basisGlsl(surface, features).map((row) => {
      const m = recurrence.order[row] as number;
      const cosine = loadLightGlsl(features, quantity, channel, recurrence.cosine[row] as number);
      const sine = loadLightGlsl(features, quantity, channel, recurrence.sine[row] as number);
      const turn = isChange
        ? `${m.toFixed(1)} * (c${m} * ${sine} - s${m} * ${cosine})`
        : `c${m} * ${cosine} + s${m} * ${sine}`;
      const value = m > 0 ? turn : isChange ? "0.0" : cosine;
      return `${texelPart("turned", channel * recurrence.order.length + row)} = ${value};`;
    }),
  );
  return lines.join("\n");
}

/** Σ of the light's luminance coefficients times the coefficients of an expansion. */
function expansionGlsl({ gradient_basis }: FreeCameraBody, features: ProbeFeatures): string {
  const sums = gradient_basis.map((row) => {
    const summands = row.flatMap((value, k) =>
      Math.abs(value) < 1e-7
        ? []
        : [
            `${floatLiteral(value)} * (${CHANNELS.map((c) => `${LUMINANCE[c]} * ${loadLightGlsl(features, "plain", c, k)}`).join(" + ")})`,
          ],
    );
    return summands.join(" + ") || "0.0";
  });
  return `vec3 local = vec3(${sums.join(", ")});`;
}

/** Radiance from a table over θo, or its difference between neighboring rows. */
function isotropicGlsl(surface: FreeCameraBody, features: ProbeFeatures, isStep = false): string {
  const rows = surface.recurrence.order.length / 4;
  const used = new Set(basisGlsl(surface, features));
  // texels of rows that hold only functions of high degree are omitted
  const lines = indexRange(rows).flatMap((q) => {
    const components = COMPONENTS.split("")
      .filter((_, k) => used.has(4 * q + k))
      .join("");
    if (components === "") return [];
    const sums = CHANNELS.map((channel) => channel * rows + q).map((k) => {
      const [nearer, farther] = ["near", "far"].map(
        (row) => `texelFetch(uIsotropic, at(${row} + ${k}), 0).${components}`,
      );
      const factor = isStep ? `(${farther} - ${nearer})` : `mix(${nearer}, ${farther}, fraction)`;
      const factors = [factor, `turned${k}.${components}`].join(components.length > 1 ? ", " : " * ");
      return components.length > 1 ? `dot(${factors})` : factors;
    });
    return `sum += vec3(${sums.join(",\n    ")});`;
  });
  return `vec3 ${isStep ? "isotropicStep(int table, int row)" : "isotropic(int table, int row, float fraction)"} {
  int near = (table * ${surface.table_rows} + row) * ${3 * rows}, far = near + ${3 * rows};
  vec3 sum = vec3(0.0);
  ${lines.join("\n  ")}
  return sum;
}`;
}

/** Radiance from a table over θo and φo. */
function anisotropicGlsl(
  { table_rows, table_columns, num_basis }: FreeCameraBody,
  features: ProbeFeatures,
  quantity: TableKind,
): string {
  const texels = num_basis / 4;
  const texel = (row: string, column: string, k: number) =>
    `texelFetch(uAnisotropic, at((${row} + ${column}) * ${3 * texels} + ${k}), 0)`;
  const sums = CHANNELS.map((channel) =>
    indexRange(Math.ceil(Math.max(features.functions, features.otherFunctions) / 4))
      .map((q) => {
        const k = channel * texels + q;
        const [nearer, farther] = ["near", "far"].map(
          (row) => `mix(${texel(row, "column", k)}, ${texel(row, "beside", k)}, blend)`,
        );
        return `dot(mix(${nearer}, ${farther}, fraction), vec4(${indexRange(4)
          .map((n) => loadLightGlsl(features, quantity, channel, 4 * q + n))
          .join(", ")}))`;
      })
      .join(" +\n    "),
  );
  return `vec3 ${quantity}Anisotropic(int table, int row, float fraction, float cp, float sp) {
  float coordinate = fract(atan(sp, cp) / 6.28318530718) * ${table_columns.toFixed(1)};
  int column = min(int(coordinate), ${table_columns - 1}), beside = (column + 1) % ${table_columns};
  float blend = coordinate - float(column);
  int near = (table * ${table_rows} + row) * ${table_columns}, far = near + ${table_columns};
  return vec3(${sums.join(",\n    ")});
}`;
}

/** Outgoing radiance from the tables of one kind; each group is a vector named `name` plus its number. */
function sumGlsl(surface: FreeCameraBody, features: ProbeFeatures, quantity: TableKind, name: string): string {
  const { isotropic, anisotropic } = features[quantity];
  const table = (group: number, k: number) =>
    quantity === "plain"
      ? `uTables[${group}].${COMPONENTS[k]}`
      : `uHighlights[${group}].${COMPONENTS[(quantity === "environment" ? 0 : 2) + k]}`;
  const groups = indexRange(NUM_GROUPS).map((group) => {
    const summands = [
      isotropic[group] && `isotropic(${table(group, 0)}, row, fraction)`,
      anisotropic[group] && `${quantity}Anisotropic(${table(group, 1)}, row, fraction, cp, sp)`,
    ];
    return `vec3 ${name}${group} = ${summands.filter(Boolean).join(" + ") || "vec3(0.0)"};`;
  });
  return `${isotropic.includes(true) ? rotatedGlsl(surface, features, quantity) : ""}
  ${groups.join("\n  ")}`;
}

/** The environment in highlights minus the lobes that pixels add: from the Zernike basis, clamped to the lobes' limits,
 * or from the light sum. */
function environmentHighlightGlsl(surface: FreeCameraBody, features: ProbeFeatures): string {
  const hasEnvironmentTables = hasTables(features.environment);
  const clampedError = (group: number) => `clamp(projected${group}, albedo / maxRatio, albedo * maxRatio) - albedo`;
  const add = (group: number) =>
    `albedo = ${albedoGlsl(`lobeTexel - ${NUM_GROUPS - group}`)} * ${hasEnvironmentTables ? "both" : "rest"}; outgoing${group} += ${hasEnvironmentTables ? clampedError(group) : "albedo"};`;
  const value = hasEnvironmentTables
    ? `${sumGlsl(surface, features, "environment", "projected")}
  float maxRatio = texelFetch(uLobes, at(lobeTexel - ${NUM_GROUPS}), 0).a;`
    : `float confidence, curvedConfidence;
  vec3 rest = uEnvironmentGain * lightSum(p, row, fraction, n, wo, cosine, confidence, curvedConfidence);
  rest = curvedConfidence * (rest - (1.0 - confidence) * both);`;
  return `vec3 both = environmentInLobes(lobes, visibility.xyz), albedo;
  ${value}
  ${indexRange(NUM_GROUPS).map(add).join("\n  ")}`;
}

const UNIFORMS = `
uniform sampler2D uVectors, uOthers, uProbePositions, uProbeNormals, uTangents, uIsotropic, uAnisotropic;
uniform int uFirst, uLobe;
uniform ivec2 uTables[${NUM_GROUPS}];
uniform ivec4 uHighlights[${NUM_GROUPS}];
uniform float uScale, uOthersScale;
uniform vec3 uCameraPosition;
`;

/** Load numbers of a probe from an array of whole texels. */
const loadGlsl = (destination: string, array: string, scale: string, numbers: number) =>
  indexRange(Math.ceil(numbers / 4))
    .map(
      (q) =>
        `${destination}${q} = ${scale} * texelFetch(${array}, at((p - uFirst) * ${Math.ceil(numbers / 4)} + ${q}), 0);`,
    )
    .join(" ");

/** Outputs of four numbers each, one per layer. */
export const outputGlsl = (layers: readonly number[]) =>
  layers.map((layer, k) => `layout(location = ${k}) out vec4 out${layer};`).join("\n");

/** GLSL functions of the probe shader and their variables. */
function functionsGlsl(surface: FreeCameraBody, features: ProbeFeatures): string {
  const kinds = (["plain", "environment", "otherLight"] as const).filter((kind) => hasTables(features[kind]));
  const isEven = kinds.some((kind) => features[kind].isotropic.includes(true));
  const numbers = (texels: string, count: number) => (count > 0 ? namedTexels(texels, Math.ceil((3 * count) / 4)) : "");
  return `${numbers("t", features.functions)}
${numbers("o", features.otherFunctions)}
${isEven ? `${namedTexels("turned", 3 * (surface.recurrence.order.length / 4))}\n${isotropicGlsl(surface, features)}` : ""}
${hasGradients(features) ? isotropicGlsl(surface, features, true) : ""}
${kinds
  .filter((kind) => features[kind].anisotropic.includes(true))
  .map((kind) => anisotropicGlsl(surface, features, kind))
  .join("\n")}`;
}

export function probeShader(surface: FreeCameraBody, features: ProbeFeatures, layers: readonly number[]): string {
  const { functions, otherFunctions, lobe, map, otherLight } = features;
  const orders = basisGlsl(surface, features).map((row) => surface.recurrence.order[row] as number);
  const otherLightGlsl = `${sumGlsl(surface, features, "otherLight", "beside")}
  ${indexRange(NUM_GROUPS)
    .map((group) => `outgoing${group} += max(beside${group}, 0.0);`)
    .join(" ")}
  ${hasGradients(features) ? lobeGradientGlsl(surface, otherLight, rotatedGlsl(surface, features, "otherLight", true)) : ""}`;
  const lobesGlsl = `int lobeTexel = (uLobe * ${surface.table_rows} + row) * ${NUM_GROUPS + 1} + ${NUM_GROUPS};
  Lobes lobes = lobesAlong(lobeTexel, fraction, n, -wo);
  visibility.xyz = lobeVisibilityOf(lobes, p);
  ${environmentHighlightGlsl(surface, features)}`;
  const values = [
    "vec4(outgoing0, outgoing1.r)",
    "vec4(outgoing1.gb, outgoing2.rg)",
    "vec4(outgoing2.b, towards)",
    "visibility",
    "gradient",
  ];
  return `${SHADER_HEADER}${elevationRowGlsl(surface.table_rows)}${lobe ? `${EQUIRECTANGULAR_GLSL}${ENVIRONMENT_GLSL}${LOBES_GLSL}${lobeVisibilityGlsl(surface)}${hasTables(features.environment) ? "" : highlightGlsl(surface)}` : ""}${UNIFORMS}
${outputGlsl(layers)}
${functionsGlsl(surface, features)}
void main() {
  int p = int(gl_FragCoord.y) * ${TEXELS_PER_ROW} + int(gl_FragCoord.x);
  vec3 n = texelFetch(uProbeNormals, at(p), 0).xyz, tangent = texelFetch(uTangents, at(p), 0).xyz;
  vec3 bitangent = cross(n, tangent), wo = uCameraPosition - texelFetch(uProbePositions, at(p), 0).xyz;
  wo *= inversesqrt(max(dot(wo, wo), 1e-20));
  float across = dot(tangent, wo), along = dot(bitangent, wo), cosine = clamp(dot(n, wo), 0.01, 1.0), fraction;
  float flatness = sqrt(across * across + along * along);
  float cp = flatness < 1e-6 ? 1.0 : across / flatness, sp = flatness < 1e-6 ? 0.0 : along / flatness;
  int row = rowOf(cosine, fraction);

  ${loadGlsl("t", "uVectors", "uScale", 3 * functions)}
  ${loadGlsl("o", "uOthers", "uOthersScale", 3 * otherFunctions)}
  ${orders.length > 0 ? rotationGlsl(Math.max(...orders) + 1) : ""}
  ${sumGlsl(surface, features, "plain", "outgoing")}
  vec4 gradient = vec4(0.0);
  ${hasTables(otherLight) ? otherLightGlsl : ""}

  vec3 towards = vec3(0.0);
  ${map ? `${expansionGlsl(surface, features)}\n  towards = local.x * tangent + local.y * bitangent + local.z * n;` : ""}
  vec4 visibility = vec4(0.0);
  ${lobe ? lobesGlsl : ""}
  ${layers.map((layer) => `out${layer} = ${values[layer]};`).join("\n  ")}
}
`;
}

/** Interpolates the lattice nodes from their neighboring probes. */
export function latticeShader(layers: readonly number[]): string {
  const interpolateGlsl = (k: string) => `p = at(int(points.${k}));
  ${layers.map((layer) => `out${layer} += weights.${k} * texelFetch(uValues, ivec3(p, ${layer}), 0);`).join("\n  ")}`;
  return `${SHADER_HEADER}
uniform usampler2D uPoints;
uniform sampler2D uWeights;
uniform sampler2DArray uValues;
${outputGlsl(layers)}
void main() {
  ivec2 here = ivec2(gl_FragCoord.xy), p;
  uvec4 points = texelFetch(uPoints, here, 0);
  vec4 weights = texelFetch(uWeights, here, 0);
  ${layers.map((layer) => `out${layer} = vec4(0.0);`).join(" ")}
  ${["x", "y", "z", "w"].map(interpolateGlsl).join("\n  ")}
}
`;
}
