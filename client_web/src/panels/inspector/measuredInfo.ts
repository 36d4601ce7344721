/** BTFs are stored with as many components as each needs, which limits their quality. */
import { getBtf } from "../../session/net/api";
import type { ParameterBody, ParamValue, Term } from "../../protocol";

const PREFIX = "btf:";
const QUALITY = "components";

/** The id of the texture that a term names. */
export function btfOf({ data }: Term): string | null {
  return data?.startsWith(PREFIX) ? data.slice(PREFIX.length) : null;
}

export const getStoredQuality = async (id: string): Promise<number> => (await getBtf(id)).components;

/** A parameter's declaration limited to the stored components; null if their number is unknown. */
export function limitToStored(info: ParameterBody, storedQuality: number | null): ParameterBody {
  if (info.name !== QUALITY || storedQuality === null) return info;
  const maximum = Math.min(info.maximum, Math.max(1, storedQuality));
  return { ...info, maximum, default: maximum };
}

/** What is in force: more components than there are, are all. */
export function isWithinStored(info: ParameterBody, value: ParamValue | undefined): ParamValue {
  return info.name === QUALITY && typeof value === "number" ? Math.min(value, info.maximum) : (value ?? info.default);
}
