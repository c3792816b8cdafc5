#include "host_tools/robot/write_urdf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

/// A stretch of the text, [from, to).
struct Span {
  std::size_t from = 0, to = 0;
};

struct LinkText {
  Span start_tag, end_tag;  ///< the end tag of <link/> is empty
  std::vector<Span> inertials;
};

struct JointText {
  std::string type, parent, child;
};

/// Where a URDF's links, their inertials and its joints stand in the text. The text is well-formed: read_urdf() has
/// read it.
class Layout {
 public:
  explicit Layout(const std::string& text) : text_(text) {
    std::size_t at = 0;
    while ((at = text_.find('<', at)) != std::string::npos) {
      if (skip(at, "<!--", "-->") || skip(at, "<![CDATA[", "]]>") || skip(at, "<?", "?>") || skip(at, "<!", ">"))
        continue;
      const std::size_t end = end_of_tag(at);
      tag({at, end});
      at = end;
    }
  }
  std::map<std::string, LinkText> links;
  std::vector<JointText> joints;

 private:
  bool skip(std::size_t& at, const char* open, const char* close) const {
    if (text_.compare(at, std::string_view(open).size(), open) != 0) return false;
    const std::size_t end = text_.find(close, at + std::string_view(open).size());
    at = end == std::string::npos ? text_.size() : end + std::string_view(close).size();
    return true;
  }
  std::size_t end_of_tag(std::size_t at) const {
    char quote = 0;
    for (; at < text_.size(); ++at) {
      const char c = text_[at];
      if (quote != 0) {
        if (c == quote) quote = 0;
      } else if (c == '"' || c == '\'') {
        quote = c;
      } else if (c == '>') {
        return at + 1;
      }
    }
    return at;
  }
  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
  std::string name_of(Span tag) const {
    std::size_t from = tag.from + 1;
    if (text_[from] == '/') ++from;
    std::size_t to = from;
    while (to < tag.to && !is_space(text_[to]) && text_[to] != '>' && text_[to] != '/') ++to;
    return text_.substr(from, to - from);
  }
  /// The value of an attribute, entities resolved; empty where there is none.
  std::string attribute(Span tag, const std::string& name) const {
    std::size_t at = tag.from;
    while (at < tag.to) {
      while (at < tag.to && !is_space(text_[at])) {
        if (text_[at] == '"' || text_[at] == '\'') at = std::min(tag.to, text_.find(text_[at], at + 1));
        ++at;
      }
      while (at < tag.to && is_space(text_[at])) ++at;
      std::size_t end = at;
      while (end < tag.to && !is_space(text_[end]) && text_[end] != '=') ++end;
      const std::string found = text_.substr(at, end - at);
      at = text_.find_first_of("\"'", end);
      if (at >= tag.to) return {};
      const std::size_t close = text_.find(text_[at], at + 1);
      if (found == name) return resolved(text_.substr(at + 1, close - at - 1));
      at = close + 1;
    }
    return {};
  }
  static std::string resolved(std::string value) {
    static const std::pair<const char*, const char*> entities[] = {
        {"&lt;", "<"}, {"&gt;", ">"}, {"&quot;", "\""}, {"&apos;", "'"}, {"&amp;", "&"}};
    for (const auto& [entity, character] : entities) {
      const std::string_view what(entity);
      for (std::size_t at = 0; (at = value.find(what, at)) != std::string::npos; ++at)
        value.replace(at, what.size(), character);
    }
    return value;
  }

  void tag(Span span) {
    const std::string name = name_of(span);
    const bool closes = text_[span.from + 1] == '/', empty = text_[span.to - 2] == '/';
    if (closes) {
      if (!path_.empty()) path_.pop_back();
      if (path_.size() == 1 && name == "link") links[link_].end_tag = span;
      if (path_.size() == 2 && path_[1] == "link" && name == "inertial") links[link_].inertials.back().to = span.to;
      return;
    }
    if (path_.size() == 1 && name == "link") {
      link_ = attribute(span, "name");
      links[link_] = {span, {}, {}};
    }
    if (path_.size() == 2 && path_[1] == "link" && name == "inertial") links[link_].inertials.push_back(span);
    if (path_.size() == 1 && name == "joint") joints.push_back({attribute(span, "type"), {}, {}});
    if (path_.size() == 2 && path_[1] == "joint") {
      if (name == "parent") joints.back().parent = attribute(span, "link");
      if (name == "child") joints.back().child = attribute(span, "link");
    }
    if (!empty) path_.push_back(name);
  }

  const std::string& text_;
  std::vector<std::string> path_;  ///< open elements
  std::string link_;
};

/// Two hyphens would end a comment of XML before its time.
std::string comment_text(std::string words) {
  for (std::size_t at = 0; (at = words.find("--", at)) != std::string::npos;) words.replace(at, 2, "- -");
  return "<!-- " + words + " -->";
}

/// @param comment empty: none
std::string inertial_text(const Inertial& body, const std::string& comment, const std::string& indent,
                          const std::string& line_end) {
  const Eigen::Vector3d& c = body.centre;
  const Eigen::Matrix3d& t = body.tensor;
  const std::string inside = line_end + indent + "  ";
  return fmt::format(
      "<inertial>{12}{0}<origin xyz=\"{1:.17g} {2:.17g} {3:.17g}\" rpy=\"0 0 0\"/>{0}<mass value=\"{4:.17g}\"/>"
      "{0}<inertia ixx=\"{5:.17g}\" ixy=\"{6:.17g}\" ixz=\"{7:.17g}\" iyy=\"{8:.17g}\" iyz=\"{9:.17g}\" "
      "izz=\"{10:.17g}\"/>{11}</inertial>",
      inside, c.x(), c.y(), c.z(), body.mass, t(0, 0), t(0, 1), t(0, 2), t(1, 1), t(1, 2), t(2, 2), line_end + indent,
      comment.empty() ? "" : inside + comment_text(comment));
}

/// The blanks before `at` on its line; empty if something else stands there.
std::string indent_of(const std::string& text, std::size_t at) {
  std::size_t from = at;
  while (from > 0 && (text[from - 1] == ' ' || text[from - 1] == '\t')) --from;
  return from == 0 || text[from - 1] == '\n' ? text.substr(from, at - from) : "";
}

/// The element together with its line where it stands alone on it.
Span with_line(const std::string& text, Span span) {
  std::size_t from = span.from, to = span.to;
  while (from > 0 && (text[from - 1] == ' ' || text[from - 1] == '\t')) --from;
  while (to < text.size() && (text[to] == ' ' || text[to] == '\t' || text[to] == '\r')) ++to;
  const bool alone = (from == 0 || text[from - 1] == '\n') && to < text.size() && text[to] == '\n';
  return alone ? Span{from, to + 1} : span;
}

}  // namespace

void write_urdf(const std::filesystem::path& original, const std::filesystem::path& out, const Robot& robot,
                const DhChain& chain, const std::vector<LinkInertia<Real>>& inertia,
                const std::vector<std::string>& comments) {
  std::string text = read_file(original);
  const Layout layout(text);
  const std::string line_end = text.find("\r\n") == std::string::npos ? "\n" : "\r\n";
  struct Edit {
    Span span;
    std::string text;
  };
  std::vector<Edit> edits;
  const auto remove = [&](const std::vector<Span>& spans, std::size_t first) {
    for (std::size_t i = first; i < spans.size(); ++i) edits.push_back({with_line(text, spans[i]), ""});
  };
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const auto found = layout.links.find(robot.joints[i].link);
    if (found == layout.links.end()) {
      throw InputError(
          fmt::format("{}: no link '{}'; is this the robot's URDF?", original.string(), robot.joints[i].link));
    }
    const LinkText& link = found->second;
    const Inertial body = to_inertial(inertia[i], chain.urdf_in_dh[i]);
    const std::string comment = comments.empty() ? "" : comments.at(i);
    const std::string outer = indent_of(text, link.start_tag.from), indent = outer + "  ";
    if (!link.inertials.empty()) {
      const Span first = link.inertials.front();
      edits.push_back({first, inertial_text(body, comment, indent_of(text, first.from), line_end)});
      remove(link.inertials, 1);
    } else if (link.end_tag.to > 0) {
      edits.push_back(
          {{link.start_tag.to, link.start_tag.to}, line_end + indent + inertial_text(body, comment, indent, line_end)});
    } else {
      edits.push_back(
          {{link.start_tag.to - 2, link.start_tag.to},
           ">" + line_end + indent + inertial_text(body, comment, indent, line_end) + line_end + outer + "</link>"});
    }
    // whatever is fixed to it
    std::vector<std::string> carried{robot.joints[i].link};
    for (std::size_t k = 0; k < carried.size(); ++k) {
      for (const JointText& joint : layout.joints) {
        if (joint.type != "fixed" || joint.parent != carried[k]) continue;
        carried.push_back(joint.child);
        if (const auto child = layout.links.find(joint.child); child != layout.links.end())
          remove(child->second.inertials, 0);
      }
    }
  }
  std::sort(edits.begin(), edits.end(), [](const Edit& a, const Edit& b) { return a.span.from > b.span.from; });
  for (const Edit& edit : edits) text.replace(edit.span.from, edit.span.to - edit.span.from, edit.text);
  write_file(out, text);
}

}  // namespace fxdyn
