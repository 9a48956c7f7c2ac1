#include <fielddeform/core/error.h>
#include <fielddeform/gffd/options.h>
#include <fmt/format.h>

#include <stdexcept>

namespace fielddeform::gffd {

void Options::validate() const {
  requirePositive("tolerance", tolerance);
  requireInRange("maxIterations", maxIterations, 1, 100000);
  requirePositive("falloffBand", falloffBand);
  requireInRange("falloffBand", falloffBand, 0, 1);
  requireInRange("substeps", substeps, 1, 64);
  if (radius) requirePositive("radius", *radius);
  requirePositive("autoRadiusFactor", autoRadiusFactor);
  field.validate();
  for (std::size_t i = 0; i < warpPairs.size(); ++i)
    if (!warpPairs[i].first.allFinite() || !warpPairs[i].second.allFinite())
      throw std::invalid_argument(fmt::format("warpPairs: pair {} is not finite", i));
}

std::string_view toString(Predictor predictor) noexcept {
  switch (predictor) {
    case Predictor::Auto: return "auto";
    case Predictor::Mls: return "mls";
    case Predictor::Axial: return "axial";
    case Predictor::Warp: return "warp";
    case Predictor::Gradient: return "gradient";
  }
  return "auto";
}

std::optional<Predictor> predictorFromString(std::string_view word) noexcept {
  for (const Predictor p : {Predictor::Auto, Predictor::Mls, Predictor::Axial, Predictor::Warp, Predictor::Gradient})
    if (word == toString(p)) return p;
  return std::nullopt;
}

std::string_view toString(Evaluation evaluation) noexcept {
  switch (evaluation) {
    case Evaluation::Auto: return "auto";
    case Evaluation::Exact: return "exact";
    case Evaluation::Grid: return "grid";
  }
  return "auto";
}

std::optional<Evaluation> evaluationFromString(std::string_view word) noexcept {
  for (const Evaluation e : {Evaluation::Auto, Evaluation::Exact, Evaluation::Grid})
    if (word == toString(e)) return e;
  return std::nullopt;
}

}  // namespace fielddeform::gffd
