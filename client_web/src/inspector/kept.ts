/** Textures from all sides are kept with as many components as each needs: their quality goes as far. */
import { getBtf } from "../net/api";
import type { ParameterBody, ParamValue, Term } from "../protocol";

const PREFIX = "btf:";
const QUALITY = "components";

/** The id of the texture that a term names. */
export function btfOf({ data }: Term): string | null {
  return data?.startsWith(PREFIX) ? data.slice(PREFIX.length) : null;
}

export const keptOf = async (id: string): Promise<number> => (await getBtf(id)).components;

/** A parameter's declaration where so many components are kept, null where that is not known. */
export function upTo(info: ParameterBody, kept: number | null): ParameterBody {
  if (info.name !== QUALITY || kept === null) return info;
  const most = Math.min(info.maximum, Math.max(1, kept));
  return { ...info, maximum: most, default: most };
}

/** What is in force: more components than there are, are all. */
export function within(info: ParameterBody, value: ParamValue | undefined): ParamValue {
  return info.name === QUALITY && typeof value === "number" ? Math.min(value, info.maximum) : (value ?? info.default);
}
