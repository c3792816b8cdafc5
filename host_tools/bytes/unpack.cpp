#include "host_tools/bytes/unpack.hpp"

#include <fmt/format.h>
#include <lz4frame.h>
#include <zstd.h>

#include <fstream>
#include <functional>
#include <memory>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// Frames of zstd that come in pieces.
class ZstdStream {
 public:
  explicit ZstdStream(std::string name) : name_(std::move(name)), stream_(::ZSTD_createDStream(), ::ZSTD_freeDStream) {
    if (!stream_) throw InputError(name_ + ": can't be unpacked: not enough memory");
    piece_.resize(::ZSTD_DStreamOutSize());
  }

  void add(std::string_view packed, const std::function<void(std::string_view)>& take) {
    ZSTD_inBuffer in{packed.data(), packed.size(), 0};
    while (in.pos < in.size) {
      ZSTD_outBuffer out{piece_.data(), piece_.size(), 0};
      left_ = ::ZSTD_decompressStream(stream_.get(), &out, &in);
      if (::ZSTD_isError(left_) != 0)
        throw InputError(
            fmt::format("{}: compressed by zstd, and damaged after {} bytes: copy it again", name_, used_ + in.pos));
      take({piece_.data(), out.pos});
    }
    used_ += packed.size();
  }

  void finish(const std::function<void(std::string_view)>& take) {
    // What the decoder still holds back.
    for (bool more = left_ != 0; more;) {
      ZSTD_inBuffer in{nullptr, 0, 0};
      ZSTD_outBuffer out{piece_.data(), piece_.size(), 0};
      left_ = ::ZSTD_decompressStream(stream_.get(), &out, &in);
      if (::ZSTD_isError(left_) != 0) break;
      take({piece_.data(), out.pos});
      more = left_ != 0 && out.pos > 0;
    }
    if (left_ != 0)
      throw InputError(fmt::format("{}: compressed by zstd, and ends in the middle: copy it again", name_));
  }

 private:
  std::string name_;
  std::unique_ptr<ZSTD_DStream, size_t (*)(ZSTD_DStream*)> stream_;
  std::vector<char> piece_;
  std::size_t left_ = 1, used_ = 0;  ///< left_: 0 at the end of a frame
};

}  // namespace

bool is_zstd(std::string_view bytes) { return bytes.starts_with("\x28\xB5\x2F\xFD"); }

std::string unpack_zstd(std::string_view packed, const std::string& name) {
  std::string out;
  const auto take = [&](std::string_view piece) { out.append(piece); };
  ZstdStream stream(name);
  stream.add(packed, take);
  stream.finish(take);
  return out;
}

bool unpack_zstd_into(std::string_view packed, char* room, std::size_t size) {
  const std::size_t got = ::ZSTD_decompress(room, size, packed.data(), packed.size());
  return ::ZSTD_isError(got) == 0 && got == size;
}

bool unpack_lz4_into(std::string_view packed, char* room, std::size_t size) {
  LZ4F_dctx* made = nullptr;
  if (::LZ4F_isError(::LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0) return false;
  const std::unique_ptr<LZ4F_dctx, LZ4F_errorCode_t (*)(LZ4F_dctx*)> context(made, ::LZ4F_freeDecompressionContext);
  std::size_t read = 0, written = 0;
  while (true) {
    std::size_t in = packed.size() - read, out = size - written;
    const std::size_t left = ::LZ4F_decompress(made, room + written, &out, packed.data() + read, &in, nullptr);
    if (::LZ4F_isError(left) != 0) return false;
    read += in;
    written += out;
    if (left == 0) return written == size;
    if (in == 0 && out == 0) return false;
  }
}

void unpack_zstd_file(const std::filesystem::path& packed, const std::filesystem::path& to) {
  std::ifstream in(packed, std::ios::binary);
  std::ofstream out(to, std::ios::binary | std::ios::trunc);
  const auto take = [&](std::string_view piece) {
    out.write(piece.data(), static_cast<std::streamsize>(piece.size()));
    if (!out)
      throw InputError(fmt::format("{}: no room to unpack it in {}; set TMPDIR to a folder with more", packed.string(),
                                   to.parent_path().string()));
  };
  ZstdStream stream(packed.string());
  std::vector<char> piece(std::size_t{1} << 20);
  while (in) {
    in.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    stream.add({piece.data(), static_cast<std::size_t>(in.gcount())}, take);
  }
  if (!in.eof()) throw InputError(packed.string() + ": can't be read; check the path of the log");
  stream.finish(take);
  out.flush();
  take({});
}

}  // namespace fxdyn
